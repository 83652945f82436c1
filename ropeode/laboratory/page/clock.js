// @ts-check
// Seconds that the last picture stays before the motion begins again.
const PAUSE = 1;

/** The time of the motion, in frames; it runs while the scene is playing. */
export class Clock {
  #last = 0;
  #rested = 0;

  /**
   * @param {import("./state").State} state
   * @param {() => number} end frames in all
   * @param {(time: number) => void} show called once for each picture, while the time moves
   */
  constructor(state, end, show) {
    this.state = state;
    this.end = end;
    this.show = show;
    this.time = state.now.time;
    const turn = (/** @type {number} */ now) => {
      this.#move(Math.min(0.1, (now - this.#last) / 1000));
      this.#last = now;
      requestAnimationFrame(turn);
    };
    requestAnimationFrame(turn);
  }

  /** @param {number} seconds */
  #move(seconds) {
    const { playing, speed } = this.state.now;
    const end = this.end();
    if (!playing || !end) return;
    if (this.time >= end && (this.#rested += seconds) < PAUSE) return;
    this.time = this.time >= end ? 0 : Math.min(end, this.time + speed * seconds);
    if (this.time < end) this.#rested = 0;
    this.show(this.time);
  }

  /** Show a time and stay there. @param {number} time in frames */
  seek(time) {
    this.time = Math.max(0, Math.min(this.end(), time));
    this.state.change({ playing: false, time: this.time });
    this.show(this.time);
  }

  /** Play, or stay. */
  toggle() {
    const { playing } = this.state.now;
    if (!playing && this.time >= this.end()) this.time = 0;
    this.state.change({ playing: !playing, time: this.time });
  }

  /** Play from the start. */
  restart() {
    this.time = 0;
    this.#rested = 0;
    this.state.change({ playing: true, time: 0 });
    this.show(0);
  }
}
