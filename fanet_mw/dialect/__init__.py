"""The MAVLink dialect of fanet-mw: fanet.xml, and the module generated from it."""
