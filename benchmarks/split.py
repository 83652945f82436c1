"""Where the time of `ropeode table` goes, in this process; `benchmarks/cli.py` runs it.

Prints one line of JSON with seconds. The first entries follow each other and are of the clock;
those from `tracing` on are what JAX says, added up over all threads.
"""

from __future__ import annotations

import json
import sys
import time
from collections import defaultdict

STARTED = time.perf_counter()

EVENTS = {
    "/jax/core/compile/jaxpr_trace_duration": "tracing",
    "/jax/core/compile/jaxpr_to_mlir_module_duration": "lowering",
    "/jax/core/compile/backend_compile_duration": "compiling or reading what was compiled",
}


def main() -> None:
    from ropeode.terminal import set_up_jax

    set_up_jax()
    import jax.monitoring

    from ropeode.render import format_table
    from ropeode.study import TableJob, accuracy_table

    spent: dict[str, float] = defaultdict(float)
    ends: dict[str, float] = {}

    def heard(event: str, seconds: float, **_: object) -> None:
        if event in EVENTS:
            spent[EVENTS[event]] += seconds

    def reaches(name: str) -> None:
        ends.setdefault(name, time.perf_counter())

    jax.monitoring.register_event_duration_secs_listener(heard)
    reaches("importing")
    job = TableJob({})
    reaches("making and checking the problem")

    reference_for, row = accuracy_table.reference_for, accuracy_table._row

    def timed_reference(*given: object, **more: object) -> object:
        found = reference_for(*given, **more)
        reaches("the reference, beside compiling steppers")
        return found

    def timed_row(*given: object) -> object:
        reaches("what is left of compiling steppers")
        return row(*given)

    accuracy_table.reference_for, accuracy_table._row = timed_reference, timed_row
    table = job.run(lambda text, fraction: None)
    reaches("the runs of the steppers")
    format_table(table)
    reaches("printing")

    times = [STARTED, *ends.values()]
    split = {name: end - start for name, start, end in zip(ends, times, times[1:], strict=False)}
    # A kept reference says how long it once took.
    computed = "ropeode.references.consensus" in sys.modules
    seconds = table.reference.certificate.seconds if computed else 0.0
    inside = {"the reference's runs, inside the above": seconds}
    print(json.dumps({**split, **inside, **spent}))


if __name__ == "__main__":
    main()
