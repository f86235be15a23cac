from mutator.cli.app import program

if __name__ == "__main__":
    raise SystemExit(program())
