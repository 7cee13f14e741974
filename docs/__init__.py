"""The script that makes the documentation's figures."""
