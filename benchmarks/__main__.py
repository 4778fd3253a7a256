"""Run benchmarks: `python -m benchmarks [PAGE | PAGE/TABLE ...] [--write]`.

--scale small: the smallest case of each, to see that it runs. --write: put the tables into docs/evidence, and what
README quotes into README. `make gates` and `make gates-compare` are `benchmarks.gates`.
"""

import argparse
import sys

from benchmarks.harness import Table, run, tables, write


def chosen(names: list[str]) -> list[Table]:
    """Return the tables that names mean; all for no names."""
    every = tables()
    if unknown := set(names) - {name for table in every for name in (table.page, table.key)}:
        raise SystemExit(f"{', '.join(unknown)}: there are {', '.join(table.key for table in every)}")
    return [table for table in every if not names or table.page in names or table.key in names]


def main() -> None:
    """Run, print and, if asked, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", nargs="*", help="pages and tables; all without")
    parser.add_argument("--scale", choices=("small", "gates", "full"), default="full")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--processes", type=int)
    arguments = parser.parse_args()
    for table in chosen(arguments.name):
        if table.absent:
            print(f"{table.key}: not measured, {table.absent[0]} is absent", file=sys.stderr)
            continue
        rows = run(table, arguments.scale, processes=arguments.processes)
        print(f"\n{table.key}\n\n{table.show(rows)}", flush=True)
        if arguments.write:
            write(table, rows, arguments.scale)
    if arguments.write:
        from benchmarks.readme import write_readme

        write_readme()


if __name__ == "__main__":
    main()
