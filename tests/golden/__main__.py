"""Check or update the golden digests of all shipped scenes, or of the named ones."""

import argparse
import sys

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.services.process_table import create_all
from tests.cosim.memory_log import MemoryLog
from tests.golden import digests, thinned_log
from tests.golden.cases import CASES, Case
from tests.golden.digests import BEGINNING, Golden


def fly(case: Case) -> tuple[MemoryLog, str]:
    """Return the complete flight of a case and the digest of its beginning."""
    config = case.resolve()
    log, diagram, beginning = MemoryLog(config), BlockDiagram(config, create_all(config), KEPT_TICKS), ""
    stops = [round(BEGINNING * config.rate) + 1, *range(KEPT_TICKS, config.last_tick + 1 + KEPT_TICKS, KEPT_TICKS)]
    for stop in sorted(stops):
        first = diagram.tick
        diagram.advance(min(stop, config.last_tick + 1))
        log.write(diagram.record_batches(first, diagram.tick), diagram.tick - 1)
        if stop == stops[0]:
            beginning = log.digest
        if diagram.ended:
            break
    return log, beginning


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help=f"one of {', '.join(CASES)}; all if none is named")
    parser.add_argument("--update", action="store_true", help="store the present digests")
    parser.add_argument("--reason", default="", help="reason for the change, for the file")
    values = parser.parse_args()
    for name in values.scenes:
        if name not in CASES:
            parser.error(f"unknown scene {name}; expected one of {', '.join(CASES)}")
    if values.update and not values.reason:
        parser.error("--update needs a --reason")
    changed = [name for name in values.scenes or CASES if not _check(name, values.update, values.reason)]
    print(f"{len(changed)} changed" if changed else "all as they were")
    return 1 if changed and not values.update else 0


def _check(name: str, update: bool, reason: str) -> bool:
    known = digests.read() if digests.FILE.exists() else {}
    log, beginning = fly(CASES[name])
    digest, path = log.digest, digests.sample_file(name)
    if name in known and known[name][:2] == (digest, beginning) and path.exists():
        print(f"{name}: {digest}", flush=True)
        return True
    print(f"{name}: {digest}, was {known[name].digest if name in known else 'not known'}")
    if path.exists():
        for line in thinned_log.first_difference(thinned_log.read(path), log):
            print(f"  {line}")
    sys.stdout.flush()
    if update:
        path.parent.mkdir(exist_ok=True)
        thinned_log.write(path, thinned_log.take(log))
        digests.write({**known, name: Golden(digest, beginning, reason)})
    return False


if __name__ == "__main__":
    sys.exit(main())
