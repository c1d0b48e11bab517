/** What cannot be drawn says so, in its own place: the rest of the page goes on. */

import { Component, type ReactNode } from "react";

interface Props {
  /** What is drawn; another one is tried again. */
  readonly about: unknown;
  readonly children: ReactNode;
}

interface State {
  readonly error: unknown;
  readonly about: unknown;
}

export class Boundary extends Component<Props, State> {
  override state: State = { error: null, about: this.props.about };

  static getDerivedStateFromError(error: unknown): Partial<State> {
    return { error };
  }

  static getDerivedStateFromProps({ about }: Props, before: State): Partial<State> | null {
    return about === before.about ? null : { error: null, about };
  }

  override render(): ReactNode {
    const { error } = this.state;
    if (error === null) return this.props.children;
    return <p className="bad note" role="alert">{`This moment cannot be shown here: ${String(error).slice(0, 300)}`}</p>;
  }
}
