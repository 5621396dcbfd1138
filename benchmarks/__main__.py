"""All benchmarks one after the other: `make bench`. Each module of this folder with a `main()` is one."""

import benchmarks
from dynamics import discovery

for name, module in discovery.modules(benchmarks).items():
    print(f"== {name}", flush=True)
    module.main()
