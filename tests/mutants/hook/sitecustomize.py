"""Plants one bug in memory, in this process and in all that it starts: `FANET_MUTANT` names the file, the place and the
new text. `tests/mutants/random_bugs.py` puts this folder on the path.
"""

import importlib.abc
import importlib.machinery
import json
import os
import sys
from pathlib import Path


class _Loader(importlib.machinery.SourceFileLoader):
    def get_code(self, fullname):
        source = Path(self.path).read_text(encoding="utf-8")
        changed = source[: BUG["begin"]] + BUG["new"] + source[BUG["end"] :]
        return compile(changed, self.path, "exec", dont_inherit=True)


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, fullname, path=None, target=None):
        if fullname != BUG["module"]:
            return None
        found = importlib.machinery.PathFinder.find_spec(fullname, path)
        if found is not None and found.origin is not None:
            found.loader = _Loader(fullname, found.origin)
        return found


if "FANET_MUTANT" in os.environ:
    BUG = json.loads(os.environ["FANET_MUTANT"])
    sys.meta_path.insert(0, _Finder())
