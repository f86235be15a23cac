"""Write all generated pages and schemas of the current clone."""

from mutator.reference.generated_files import write_files
from mutator.workspace import Workspace

if __name__ == "__main__":
    for path in write_files(Workspace.find()):
        print(path)
