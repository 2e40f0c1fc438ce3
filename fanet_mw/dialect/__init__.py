"""The MAVLink dialect of fanet-mw: fanet.xml, the module generated from it, and `export_xml.py` for other tools."""
