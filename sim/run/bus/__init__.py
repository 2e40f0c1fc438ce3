"""The bus of a swarm as its operator meets it: router, certificates, rights, running swarms, changes of the air."""
