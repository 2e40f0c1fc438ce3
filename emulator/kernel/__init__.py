"""The 802.11 kernel: stations, DCF and PHY as plain functions over arrays, compiled when numba is installed."""
