"""Parts for fanet-mw, each behind one of its contracts; pyproject.toml names them."""
