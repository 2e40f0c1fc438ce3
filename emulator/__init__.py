"""The link emulator: decides who hears whom. Frames are bytes to it."""
