"""Kan, Gao and Min (2022): PPP/INS tightly coupled, and what the IMU's rate does to it."""
