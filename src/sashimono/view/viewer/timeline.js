// Where every part is at a given time.

class Timeline {
  constructor(plan) {
    this.steps = plan.steps;
    this.duration = plan.duration;
    this.assembled = plan.parts.map((part) => part.assembled);
    this.stepsOfPart = plan.parts.map(() => []);
    this.solved = plan.parts.map((part) => part.solved);
    plan.steps.forEach((step, k) => step.moving.forEach((part) => this.stepsOfPart[part].push(k)));
    this.twists = plan.steps.map((step) => new Array(step.poses.length - 1));
  }

  /** Index of the step at time t, -1 if there are none. */
  stepAt(t) {
    let k = this.steps.length - 1;
    while (k > 0 && t < this.steps[k].start) k--;
    return k;
  }

  /** The step that a part is in at time t, or was last, or comes first; -1 if it has none. Members of a subassembly have several. */
  stepOf(part, t) {
    const steps = this.stepsOfPart[part];
    return steps.findLast((k) => this.steps[k].start <= t) ?? steps[0] ?? -1;
  }

  /** The step that brings a part to where it belongs, -1 if it has none. */
  lastStepOf(part) {
    return this.stepsOfPart[part].at(-1) ?? -1;
  }

  /** Where the step's part waits: at first, or for a subassembly where it is carried to. */
  restingPose(k) {
    return this.steps[k].poses[this.#carried(k)];
  }

  /** When the step's planned motion begins: at its start, or once it is carried to where it waits. */
  plannedFrom(k) {
    const carried = this.#carried(k);
    return carried > 0 ? this.steps[k].times[carried] : this.steps[k].start;
  }

  #carried(k) {
    return this.steps[k].segments.find((segment) => segment.kind === "carry")?.stop ?? 0;
  }

  /** Share of the step's motion that is done at time t, in [0, 1]. */
  progress(k, t) {
    const times = this.steps[k].times;
    const span = times[times.length - 1] - times[0];
    if (span <= 0) return t >= times[0] ? 1 : 0;
    return Math.min(Math.max((t - times[0]) / span, 0), 1);
  }

  /** The interval of the step's poses at time t, and where in it. */
  interval(k, t) {
    const times = this.steps[k].times;
    const last = times.length - 1;
    if (last === 0 || t <= times[0]) return [0, 0];
    if (t >= times[last]) return [last - 1, 1];
    let low = 0;
    let high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle;
      else high = middle;
    }
    return [low, (t - times[low]) / (times[high] - times[low])];
  }

  /** What the step is doing at time t: "hold", "carry", "transit" or "insertion". */
  phase(k, t) {
    const step = this.steps[k];
    if (t < step.times[0] || t >= step.times[step.times.length - 1]) return "hold";
    const [i] = this.interval(k, t);
    const segment = step.segments.find((s) => s.start <= i && i < s.stop);
    return segment ? segment.kind : "hold";
  }

  /** T_world_part at time t. A part without a step stays where it belongs. */
  pose(part, t) {
    const k = this.stepOf(part, t);
    return k < 0 ? this.assembled[part] : this.carried(k, part, this.#path(k, t));
  }

  /** Where a part is that moves in step k, when the step's own part is at a pose: all undergo the same displacement. */
  carried(k, part, pose) {
    const leader = this.steps[k].part;
    if (part === leader) return pose;
    return compose(compose(pose, inverse(this.assembled[leader])), this.assembled[part]);
  }

  #path(k, t) {
    const { poses } = this.steps[k];
    const [i, u] = this.interval(k, t);
    if (u <= 0) return poses[i];
    if (u >= 1) return poses[i + 1];
    this.twists[k][i] ??= logPose(compose(inverse(poses[i]), poses[i + 1]));
    return compose(poses[i], expTwist(this.twists[k][i], u));
  }

  /** "waiting", "moving", "placed" or "unsolved"; what is unsolved may move with a subassembly all the same. */
  state(part, t) {
    const k = this.stepOf(part, t);
    if (!this.solved[part]) return "unsolved";
    const step = this.steps[k];
    if (t < step.start) return "waiting";
    return t < step.stop && step.poses.length > 1 ? "moving" : "placed";
  }
}
