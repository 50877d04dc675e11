"""Benchmarks of tsdyn against code written by hand and other engines, such as python -m benchmarks.step_cost."""
