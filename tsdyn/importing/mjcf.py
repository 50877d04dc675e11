def describe(root, path, report):
    raise NotImplementedError
