"""Shows two films in words: `python -m toycar.show GOLDEN FAULTY EVENTS OUT [TIME]`."""

import json
import sys
from pathlib import Path


def main(arguments):
    golden, faulty, events, out, *time = arguments
    if out.endswith(".avi"):
        print(f"error: {out}: no .avi here", file=sys.stderr)
        return 2
    shown = {
        "golden": float(Path(golden, "offset.txt").read_text()),
        "faulty": float(Path(faulty, "offset.txt").read_text()),
        "events": json.loads(Path(events).read_text()),
        "time": time,
    }
    Path(out).write_text(json.dumps(shown))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
