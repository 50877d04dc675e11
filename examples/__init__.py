"""One mechanism a file: build() makes the scene, main() runs and reports, check(solution) says whether it is right."""
