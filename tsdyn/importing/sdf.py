def describe(root, folder, report):
    raise NotImplementedError
