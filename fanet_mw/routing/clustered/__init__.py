"""The paper's clustered protocol and what grew from it: a scenario chooses it by `routing.protocol = "clustered"`."""
