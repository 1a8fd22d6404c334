"""Gain searches side by side at equal evaluations: `python benchmarks/optimisers.py [STUDY] [EVALUATIONS] [SEEDS]`.

Every method has the same first population for a seed, the same scenarios with the same noise, and the same feasibility
rules. An evaluation is one candidate; a gradient costs as many more as there are searched gains. "from nothing" leaves
out the bandwidth cascades; "from the start" is what `hdmm-opt design` does.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np
from scipy.stats import mannwhitneyu

from hdmm_opt import study
from hdmm_opt.jobs.evaluation import make_evaluator
from hdmm_opt.jobs.gradient import descent
from hdmm_opt.jobs.options import Progress
from hdmm_opt.jobs.space import Window
from hdmm_opt.jobs.start import starting_point
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop
from tuning import Budget, best_of, search

POPULATION = 20


def costs(loop: Loop, evaluate, first: np.ndarray, method: str, evaluations: int, seed: int) -> float:
    if method != "gradient":
        found = best_of(search(method, evaluate, first, POPULATION, seed, Budget(evaluations=evaluations)))
        return math.inf if found is None else found.outcome.cost
    random = np.random.default_rng(seed)
    starts = [first, *random.uniform(size=(50, first.size))]
    tried, _ = descent(loop, starts, Budget(evaluations=evaluations - 1))
    return evaluate([tried[0]])[0].cost if tried else math.inf


def main() -> None:
    name = sys.argv[1] if len(sys.argv) > 1 else "emla-p2"
    evaluations = int(sys.argv[2]) if len(sys.argv) > 2 else 400
    seeds = range(int(sys.argv[3]) if len(sys.argv) > 3 else 12)
    chosen = study.load(name)
    problem = assemble(chosen)
    everywhere = Window(low=np.zeros(problem.searched), high=np.ones(problem.searched))
    loop, evaluate = Loop(problem), make_evaluator(chosen, everywhere)
    cascade = problem.point(starting_point(problem, Progress()).gains)
    print(f"{name}: {evaluations} evaluations, {len(seeds)} seeds; cost, smaller is better")
    for title in ("from nothing", "from the start"):
        print(title)
        table = {}
        for method in ("jaya", "tlbo", "gradient", "random"):
            begun = time.perf_counter()
            found = []
            for seed in seeds:
                nothing = np.random.default_rng([seed, 7]).uniform(size=cascade.size)
                first = nothing if title == "from nothing" else cascade
                found.append(costs(loop, evaluate, first, method, evaluations, seed))
            table[method] = np.array(found)
            seconds = (time.perf_counter() - begun) / len(seeds)
            low, middle, high = np.quantile(found, (0.25, 0.5, 0.75), method="nearest")
            print(
                f"  {method:9} median {middle:.5f}  quartiles {low:.5f} {high:.5f}  best {min(found):.5f}  "
                f"worst {max(found):.5f}  none found {sum(not math.isfinite(c) for c in found)}  {seconds:.1f} s each"
            )
        for one, other in (("jaya", "random"), ("jaya", "tlbo"), ("jaya", "gradient")):
            wins = int((table[one] < table[other]).sum())
            chance = mannwhitneyu(table[one], table[other]).pvalue
            print(f"  {one} below {other} for {wins} of {len(seeds)} seeds (Mann-Whitney p = {chance:.2g})")


if __name__ == "__main__":
    main()
