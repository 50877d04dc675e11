"""One mechanism a file: build() makes the scene, main() runs and reports, check(solution) verifies the result."""
