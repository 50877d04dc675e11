"""Words and answers of commands: a parser that answers a wrong word with the nearest right one; JSON for machines."""

import argparse
import json
import math
import re

import numpy as np

from ..validation import close

# What commands give to machines: JSON, in which what is no finite number is null; text in cells of CSV.


def print_json(data):
    """Print data as JSON."""
    print(json.dumps(plain(data), indent=1, allow_nan=False))


def plain(value):
    """Data for JSON: numbers of NumPy as Python's, NaN and infinities as None."""
    if isinstance(value, dict):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, (int, str, type(None))) else str(value)


# A parser of arguments that answers a wrong word with the nearest right one.

ELSEWHERE = {  # options of other programs, and of earlier versions
    "--figure": "a figure is drawn with --plot [PATH]",
    "--no-figure": "a figure is drawn with --plot only",
    "--t-end": "the end of the run is --to",
    "--end": "the end of the run is --to",
    "--until": "the end of the run is --to",
    "--duration": "the end of the run is --to",
    "--t-start": "the start of the run stands in the file: [run] start",
    "--outputs": "the interval of outputs is --every",
    "--dt": "the interval of outputs is --every; a fixed step stands in the file: [run] method",
    "--integrator": "the integrator is --method",
    "--solver": "the integrator is --method",
    "--step": "a fixed step stands in the file: [run] method",
    "--tol": "tolerances are --rtol and --atol",
    "-o": "results are written with --output",
    "--overwrite": "files are overwritten with --force",
}


class Parser(argparse.ArgumentParser):
    """An `ArgumentParser` whose errors end with the nearest right words."""

    given = ()  # arguments of the command line, of the parsers of all commands

    def error(self, message):
        """Exit with code 2 after the usage, the message and what may have been meant; with --json as JSON, too."""
        message += self._hint(message)
        if "--json" in self.given:
            print_json({"error": "WrongUsage", "message": message})
        super().error(message)

    def _hint(self, message):
        """What may have been meant; empty if nothing is near."""
        choice = re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if choice:
            return _meant(choice[1], [word.strip(" '") for word in choice[2].split(",")])
        if re.search(r"argument --(to|every): invalid float", message):
            return "; it is a time in s. Results are written with --output"
        unknown = re.search(r"unrecognized arguments: (.*)", message)
        words = [word.partition("=")[0] for word in unknown[1].split() if word.startswith("-")] if unknown else []
        return "".join(f"; {ELSEWHERE[word]}" if word in ELSEWHERE else _meant(word, self._options()) for word in words)

    def _options(self):
        """Options of the command that is given."""
        found = list(self._option_string_actions)
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                for word in self.given:
                    if word in action.choices:
                        return [*dict.fromkeys([*found, *action.choices[word]._option_string_actions])]
        return found


def _meant(word, known):
    near = close(word, known)
    return f"; did you mean {' or '.join(near)}?" if near else ""
