"""Fuzzers: of calls (calls.py); small samples of them are in the suite, any number by the command line."""
