"""For the tests of those who build on fanet-mw; needs pytest."""
