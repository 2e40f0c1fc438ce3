"""What Wireshark needs to read a capture: the dissector that scripts/generate_dissector.py makes."""
