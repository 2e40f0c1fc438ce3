"""Real radios, under the same contract as the emulated medium: transmit requests in, receptions and statuses out."""
