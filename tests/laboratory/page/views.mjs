// A small motion and its runs, as the page would have them.

/** @param {number[]} data */
export function array(data, shape = [data.length]) {
  return { data: Float32Array.from(data), shape };
}

/** Texts are their keys, with their values. */
export function say(key, values = {}) {
  return [key, ...Object.values(values)].join(" ");
}

export function run(steps, more = {}) {
  return {
    kind: "run", stepper: "rk4", steps_per_frame: steps, dt: 1 / steps, every: 1, status: "ok",
    diverged_at: null, error_max: 1e-3, resolution: 1e-8, rhs_evaluations: 4 * steps, seconds: 1e-3 / steps, ...more,
  };
}

export function shown(more = {}) {
  const arrays = {
    errors: array([0, 1e-10, 1e-3]),
    differences: array([0, 0, 3, 4, 0, 0], [3, 1, 2]),
    energy_differences: array([0, -1e-3, 2e-3]),
  };
  return {
    name: "rk4", color: "#000", dash: "", run: { ...run(4), arrays }, ladder: [run(4)],
    order: null, theory: null, phase: null, stability: null,
    absent: { run: "waiting", order: "waiting", phase: "waiting", stability: "waiting" }, ...more,
  };
}

export function view(more = {}) {
  const arrays = {
    times: array([0, 1, 2, 3]),
    points: array([0, 0, 1, 0, 2, 0, 2, 2], [4, 1, 2]),
    bound: array([0, 1e-9, 1e-9]),
    energy: array([5, 5, 5]),
    energy_bound: array([1e-9, 1e-9, 1e-9]),
  };
  return {
    say,
    truth: {
      kind: "truth", words: "a point", frame: 1, frames: 3, samples_per_frame: 1, trusted: 3,
      horizon: 2, norm: "largest distance", drawing: "orbit", links: [], fixed: [],
      nodes: [0], axes: ["x", "y"], time_unit: "frames", energy_unit: "", certificate: [], arrays,
    },
    truthPhase: null, absentPhase: "waiting", shown: [shown()], node: null, dt: 0.25,
    choices: {
      motion: "error", steps: "order", axis: "dt", energy: "linear", phase: "component 0",
      region: "0",
    },
    ...more,
  };
}
