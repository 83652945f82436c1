// Written by tools/message_types.py from ropeode/laboratory/messages.py: change that file.
// Arrays of an answer are not in its JSON; its comment names them.

export type Ask = Wanted["ask"];
export type Answer =
  | Checked
  | Command
  | FilmFile
  | Graded
  | Library
  | Order
  | Phase
  | Refused
  | Reloaded
  | Run
  | Stability
  | Theory
  | Truth
  | Working

/**
 * The verdict of `ropeode check` on a stepper; `quick` leaves out what takes long.
 */
export interface AskCheck {
  kind: "check";
  stepper: string;
  quick?: boolean;
  version?: string | null;
}

/**
 * The command, and the Python code, that compute what the page shows.
 */
export interface AskCommand {
  kind: "command";
  problem: ProblemChoice;
  steppers: string[];
  steps_per_frame: number[];
}

/**
 * The same as a GIF.
 */
export interface AskFilm {
  kind: "film";
  problem: ProblemChoice;
  steppers: string[];
  steps_per_frame: number;
  version?: string | null;
}

/**
 * The verdict of `ropeode grade` on CSV files, and their trajectories.
 */
export interface AskGrade {
  kind: "grade";
  problem: ProblemChoice;
  files: GivenFile[];
}

/**
 * What can be chosen.
 */
export interface AskLibrary {
  kind: "library";
}

/**
 * The observed order from runs with these steps per frame.
 */
export interface AskOrder {
  problem: ProblemChoice;
  stepper: string;
  version?: string | null;
  kind: "order";
  steps_per_frame: number[];
}

/**
 * Position and velocity of one component of a node, or of a mode, along the reference and runs.
 *
 * `mode` counts from the slowest; it is for ropes.
 */
export interface AskPhase {
  kind: "phase";
  problem: ProblemChoice;
  stepper?: string | null;
  steps_per_frame?: number | null;
  version?: string | null;
  node?: number | null;
  component?: number;
  mode?: number | null;
}

/**
 * One run of a stepper, beside the reference.
 */
export interface AskRun {
  problem: ProblemChoice;
  stepper: string;
  version?: string | null;
  kind: "run";
  steps_per_frame: number;
}

/**
 * The stability region of a stepper, and the problem's eigenvalues.
 */
export interface AskStability {
  problem: ProblemChoice;
  stepper: string;
  version?: string | null;
  kind: "stability";
}

/**
 * What theory predicts of the error as the step size goes to zero.
 */
export interface AskTheory {
  problem: ProblemChoice;
  stepper: string;
  version?: string | null;
  kind: "theory";
}

/**
 * The certified reference.
 */
export interface AskTruth {
  kind: "truth";
  problem: ProblemChoice;
}

/**
 * Answer to `check`: the lines of `ropeode check`.
 *
 * Where `quick` has left out some of all the checks, no line is a verdict.
 */
export interface Checked {
  kind: "check";
  stepper: string;
  made: number;
  checks: number;
  lines: Line[];
}

/**
 * Answer to `command`.
 */
export interface Command {
  kind: "command";
  command: string | null;
  python: string;
}

/**
 * Answer to `film`: the GIF, in base64.
 */
export interface FilmFile {
  kind: "film";
  gif: string;
}

/**
 * A file of trajectories that was dropped on the page.
 */
export interface GivenFile {
  name: string;
  text: string;
}

/**
 * Answer to `grade`: the lines of `ropeode grade`, and runs like those of steppers.
 *
 * Arrays: those of each run, with its number before the name: "0.differences".
 */
export interface Graded {
  kind: "grade";
  lines: Line[];
  runs: Run[];
}

/**
 * A point that the fit leaves out, and why.
 */
export interface LeftOutPoint {
  steps_per_frame: number;
  why: string;
}

/**
 * Answer to `library`.
 */
export interface Library {
  kind: "library";
  problems: ProblemFacts[];
  steppers: StepperFacts[];
  own: OwnStepper[];
  scenes: SceneFacts[];
}

/**
 * A line of a report: what kind of line it is, and its text.
 *
 * Kinds: "title"; the status of a finding, "pass", "fail", "undetermined", "note" or "skip";
 * "diagnosis"; and the verdict, "right", "wrong" or "undetermined", in the second line where
 * all checks are made.
 */
export interface Line {
  status: string;
  text: string;
}

/**
 * Answer to `order`: the verdict in the words of `ropeode table`.
 */
export interface Order {
  kind: "order";
  stepper: string;
  observed: number | null;
  low: number | null;
  high: number | null;
  verdict: string;
  words: string;
  used: number[];
  left_out: LeftOutPoint[];
  constant: number | null;
}

/**
 * A stepper from the file that the lab was opened with.
 */
export interface OwnStepper {
  name: string;
  version: string | null;
  fault: string | null;
  line: number | null;
}

/**
 * A parameter of a problem, as its control shows it.
 */
export interface ParameterFacts {
  name: string;
  default: unknown;
  allowed: string;
  whole: boolean;
  low: number | null;
  high: number | null;
  logarithmic: boolean;
  unit: string;
  words: string;
}

/**
 * Answer to `phase`. Arrays: x (samples,), v (samples,). `every` as in `Run`.
 */
export interface Phase {
  kind: "phase";
  every: number;
  x_label: string;
  v_label: string;
}

/**
 * A problem of the library (or the one that the lab was opened with) and its parameters.
 */
export interface ProblemChoice {
  name?: string;
  parameters?: { [name: string]: unknown };
  frames?: number;
}

/**
 * A problem that can be chosen.
 */
export interface ProblemFacts {
  name: string;
  words: string;
  parameters: ParameterFacts[];
  frames: number;
  most_frames: number;
  steppers: string[];
  default_steppers: string[];
}

/**
 * Answer to a question that has none: a sentence that names the field, and how to mend it.
 */
export interface Refused {
  kind: "refused";
  message: string;
  line: number | null;
}

/**
 * The user's file has changed: ask for the library again.
 */
export interface Reloaded {
  kind: "reloaded";
  own: OwnStepper[];
}

/**
 * Answer to `run`. Its samples are every ``every``-th of the reference's.
 *
 * Arrays: differences (samples, points, 2) of what is drawn from the reference, up to the last
 * finite sample; errors (trusted,): in the problem's norm, at the samples that are trusted;
 * energy_differences (known,) from the true energy, where there is one. The
 * largest error is that of `ropeode table`, at the frames.
 */
export interface Run {
  kind: "run";
  stepper: string;
  steps_per_frame: number | null;
  dt: number;
  every: number;
  status: "ok" | "diverged" | "unsolved";
  diverged_at: number | null;
  error_max: number | null;
  resolution: number;
  rhs_evaluations: number | null;
  seconds: number | null;
}

/**
 * A lesson, or a figure of the published report; texts by language ("en", "zh").
 */
export interface SceneFacts {
  name: string;
  title: { [name: string]: string };
  text: { [name: string]: string };
  page: string;
  state: SceneState;
}

/**
 * What a scene sets of the page's state.
 */
export interface SceneState {
  problem: ProblemChoice;
  steppers: string[];
  ladder: number[];
  plot: "error" | "energy" | "phase" | "order" | "stability";
}

/**
 * Answer to `stability`.
 *
 * Arrays: radius (rows, columns), of the stability function over the box, from below and from
 * the left; times (times,); eigenvalues (times, values, 2): real and imaginary, of the right-hand
 * side along the reference.
 */
export interface Stability {
  kind: "stability";
  stepper: string;
  real: [number, number] | null;
  imaginary: [number, number] | null;
  why_none: string | null;
  largest_stable_dt: number | null;
  words: string;
}

/**
 * A stepper that can be chosen, with its options (name to values, the first is the default).
 */
export interface StepperFacts {
  name: string;
  family: string;
  options: { [name: string]: string[] };
}

/**
 * Answer to `theory`: error_max = constant * dt**order near dt = 0, or why there is none.
 */
export interface Theory {
  kind: "theory";
  stepper: string;
  order: number | null;
  constant: number | null;
  words: string;
}

/**
 * Answer to `truth`. Samples are ``samples_per_frame`` in each frame.
 *
 * Arrays: times (samples,); points (samples, points, 2): what is drawn; bound (trusted,): of the
 * error; energy and energy_bound (known,): the true energy at the first samples and how far it
 * may be wrong, where the problem has one.
 */
export interface Truth {
  kind: "truth";
  words: string;
  frame: number;
  frames: number;
  samples_per_frame: number;
  trusted: number;
  horizon: number | null;
  norm: string;
  drawing: "rope" | "pendulum" | "orbit" | "phase";
  links: [number, number][];
  fixed: number[];
  nodes: (number | null)[];
  axes: [string, string];
  time_unit: string;
  energy_unit: string;
  certificate: string[];
}

/**
 * Everything that the page wants now, the most urgent first.
 */
export interface Want {
  want: Wanted[];
}

/**
 * A question, with the key that its answer carries.
 */
export interface Wanted {
  key: string;
  ask: AskLibrary | AskTruth | AskRun | AskOrder | AskTheory | AskStability | AskPhase | AskCheck | AskGrade | AskCommand | AskFilm;
}

/**
 * What is being computed.
 */
export interface Working {
  kind: "working";
  key: string;
  text: string;
}
