"""The swarm in 3-D in a browser, live or again (viser); a listener that changes nothing unless somebody presses."""
