/** Panes take turns: while somebody scrubs, a frame has no time to draw all of them. */

/** Of a frame, for panes; each frame draws one at least. */
export const FRAME_MS = 10;
/** Who stays at a moment so long has arrived there. */
export const CALM_MS = 120;
/** What waits until nothing moves is done after so long in any case. */
export const PATIENCE_MS = 500;

export interface Pane<M> {
  /** Draw this moment now. */
  draw(moment: M): void;
}

/** Where time and frames come from. */
export interface Screen {
  now(): number;
  frame(draw: () => void): void;
  later(act: () => void, ms: number): unknown;
  forget(timer: unknown): void;
  /** Whether panes are behind. */
  busy(is: boolean): void;
}

/** Which pane draws when: those that are behind, the longest first; moments in between are left out. */
export class Turns<M> {
  private readonly panes = new Set<Pane<M>>();
  private readonly behind = new Set<Pane<M>>();
  private readonly waiting = new Set<() => void>();
  private waited = 0;
  private drawing = false;
  private timer: unknown = null;
  private moving = false;

  constructor(public moment: M, private readonly screen: Screen) {}

  join(pane: Pane<M>): () => void {
    this.panes.add(pane);
    return () => {
      this.panes.delete(pane);
      this.behind.delete(pane);
    };
  }

  /** Show a moment: in all panes at once if nothing moved before, else frame by frame in those whose turn it is. */
  show(moment: M): void {
    if (moment === this.moment) return;
    this.moment = moment;
    this.moving = this.timer !== null;
    if (this.moving) this.screen.forget(this.timer);
    this.timer = this.screen.later(() => this.calm(), CALM_MS);
    if (this.moving) this.scrubbed();
    else for (const pane of this.panes) pane.draw(moment);
  }

  /** Act once nothing moves any more, at once if nothing does. Returns how to call it off. */
  whenCalm(act: () => void): () => void {
    if (this.moving) this.waiting.add(act);
    else act();
    return () => void this.waiting.delete(act);
  }

  private scrubbed(): void {
    for (const pane of this.panes) this.behind.add(pane); // who waits already keeps the place
    this.screen.busy(true);
    if (this.drawing) return;
    this.drawing = true;
    this.screen.frame(() => this.draw());
  }

  private draw(): void {
    const start = this.screen.now();
    for (const pane of this.behind) {
      this.behind.delete(pane);
      pane.draw(this.moment);
      if (this.screen.now() - start >= FRAME_MS) break;
    }
    if (start - this.waited > PATIENCE_MS) this.act();
    this.drawing = this.behind.size > 0;
    if (this.drawing) this.screen.frame(() => this.draw());
    else this.screen.busy(false);
  }

  private calm(): void {
    this.timer = null;
    this.moving = false;
    this.act();
  }

  private act(): void {
    this.waited = this.screen.now();
    const acts = [...this.waiting];
    this.waiting.clear();
    for (const act of acts) act();
  }
}
