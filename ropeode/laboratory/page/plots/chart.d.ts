// What a plot shows, before it has a size. Functions make it from answers; `figure.js` draws it.

// In the language of the page; or Python's, which are English.
export type Words = string | { english: string };

export interface Axis {
  // With its unit.
  label: Words;
  kind: "linear" | "log" | "signed";
  low: number;
  high: number;
  // Of the kind "signed": linear up to here.
  threshold?: number;
}

export interface LineMark {
  kind: "line";
  x: ArrayLike<number>;
  y: ArrayLike<number>;
  color: string;
  // As of SVG; empty for a solid line.
  dash: string;
  width: number;
  // Whether it bends between its places.
  smooth?: boolean;
}

// What nothing can be told from: between two curves, or below one.
export interface BandMark {
  kind: "band";
  x: ArrayLike<number>;
  y: ArrayLike<number>;
  low?: ArrayLike<number>;
}

export interface RuleMark {
  kind: "rule";
  x?: number;
  y?: number;
  label: string;
}

export type Shape =
  | "disc"
  | "ring"
  | "cross"
  | "plus"
  | "diamond"
  | "star"
  | "down"
  | "up";

export interface PointMark {
  kind: "point";
  x: number;
  y: number;
  shape: Shape;
  color: string;
  // What it is, for hovering and for the keyboard; null for a point that cannot be chosen.
  words: string | null;
}

export interface RegionMark {
  kind: "region";
  polygons: [number, number][][];
  edges: [[number, number], [number, number]][];
  color: string;
}

export interface TextMark {
  kind: "text";
  x: number;
  y: number;
  // Stands above its place.
  text: string;
}

export type Mark = LineMark | BandMark | RuleMark | PointMark | RegionMark | TextMark;

export interface Entry {
  color: string;
  dash: string | null;
  shape: Shape | null;
  text: string;
  // After the name, in smaller letters.
  more?: Words[];
}

export interface Moving {
  x: number;
  y: number;
  color: string;
  // Hollow, at the edge: the point itself lies outside.
  outside?: boolean;
}

// What a reader may change in a plot.
export interface Choice {
  name: string;
  label: string;
  value: string;
  options: { value: string; label: string }[];
}

export interface Chart {
  title: string;
  x: Axis;
  y: Axis;
  // Whether both axes have one scale.
  equal?: boolean;
  // The last is on top.
  marks: Mark[];
  legend: Entry[];
  // What marks mean that are not of one stepper.
  meanings?: Entry[];
  choices?: Choice[];
  // Sentences below the plot.
  notes: Words[];
  table: { head: string[]; rows: string[][] };
  // Where the horizontal axis is time: the values of the legend's entries then.
  at?: (time: number) => string[];
  // Points that move as the picture plays; the same list as long as none has moved.
  moving?: (time: number) => Moving[];
}

// Why there is no chart, and what may be chosen in its place.
export interface Missing {
  why: Words;
  choices?: Choice[];
}
