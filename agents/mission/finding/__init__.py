"""Finding survivors: where phones were received, which people were seen, who carries which phone, who is confirmed."""
