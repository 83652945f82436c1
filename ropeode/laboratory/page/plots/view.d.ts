// What the plots are made from: answers, and what of the page's state concerns them.

import type { Words } from "./chart.js";
import type { Order, Phase, Run, Stability, Theory, Truth } from "../messages.js";

export interface NumberArray {
  data: Float32Array;
  shape: number[];
}

export type WithArrays<Answer> = Answer & { arrays: Record<string, NumberArray> };

// A stepper that is shown, with what is known of it so far.
export interface Shown {
  name: string;
  color: string;
  // As of SVG; empty for a solid line.
  dash: string;
  // The run with the present steps per frame.
  run: WithArrays<Run> | null;
  // All runs so far, which the order is found from.
  ladder: Run[];
  order: Order | null;
  theory: Theory | null;
  phase: WithArrays<Phase> | null;
  stability: WithArrays<Stability> | null;
  // What is said in the place of an answer that is not there.
  absent: Record<"run" | "order" | "phase" | "stability", Words>;
}

// What a reader has chosen; part of the link.
export interface Choices {
  // Which plot each group shows.
  motion: "error" | "energy" | "phase";
  steps: "order" | "stability";
  // The horizontal axis of the order plot.
  axis: "dt" | "evaluations" | "seconds";
  energy: "linear" | "signed";
  // What the phase plane shows: "component 0", "mode 0" ...
  phase: string;
  // Number of the stepper whose stability region is shown.
  region: string;
}

export interface View {
  say: (key: string, values?: Record<string, string | number>) => string;
  truth: WithArrays<Truth>;
  truthPhase: WithArrays<Phase> | null;
  // What is said in its place.
  absentPhase: Words;
  shown: Shown[];
  // The chosen node; null for none.
  node: number | null;
  dt: number;
  choices: Choices;
}
