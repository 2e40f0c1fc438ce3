"""Real radios behind the contract that the emulated medium keeps: transmit requests in, receptions and statuses out."""
