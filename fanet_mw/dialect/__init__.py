"""Our MAVLink dialect: fanet.xml and the module generated from it."""
