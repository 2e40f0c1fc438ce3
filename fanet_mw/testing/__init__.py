"""Fixtures and a contract suite for the tests of parts that build on fanet-mw; needs pytest.

`plugin` has the fixtures, which pytest finds by itself where fanet-mw is installed; `routing_contract` is the suite
that a routing protocol runs against itself.
"""
