"""Which phones were heard where, which people were seen, whose phone is whose, and who is confirmed."""
