"""Trials from outside: shapes and light that were once wrong, tried again through the public API alone."""
