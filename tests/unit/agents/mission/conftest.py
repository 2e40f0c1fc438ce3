"""The tests in the folders below share `search_board.py`, which stands beside this file and so can be imported."""
