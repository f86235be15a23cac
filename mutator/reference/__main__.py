"""`python -m mutator.reference`: write every generated page and schema of the clone it is run in."""

from mutator.reference.pages import write
from mutator.workspace import Workspace

if __name__ == "__main__":
    for path in write(Workspace.find()):
        print(path)
