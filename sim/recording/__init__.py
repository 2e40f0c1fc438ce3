"""A run in the formats of other tools: tidy tables (parquet, CSV) and MCAP for Foxglove and PlotJuggler."""
