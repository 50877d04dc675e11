"""What tsdyn costs, measured against code written by hand; run a file, or python -m benchmarks.step_cost."""
