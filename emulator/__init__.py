"""The link emulator of fanet-mw: it decides which station receives which frame. A frame is only bytes to it."""
