"""The link emulator of fanet-mw: decides who hears whom. Frames are bytes to it."""
