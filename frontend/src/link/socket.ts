/** The socket over which records come; it asks anew where it was when it was lost. */

import type { Rec } from "../core/records";

export interface Hello {
  readonly type: "hello";
  readonly header: Readonly<Record<string, unknown>>;
  readonly last: number;
  readonly live: boolean;
  readonly control: boolean;
}

export interface Status {
  readonly type: "status";
  readonly last: number;
  readonly live: boolean;
  readonly ended: boolean;
  readonly paused: string | null;
}

interface Records {
  readonly type: "records";
  readonly from: number;
  readonly records: readonly Rec[];
}

export interface Listener {
  /** The number of the first record that is wanted. */
  wanted(): number;
  hello(said: Hello): void;
  status(said: Status): void;
  records(from: number, records: readonly Rec[]): void;
  lost(): void;
}

const AGAIN_MS = 1500;

export function connect(listener: Listener): void {
  const socket = new WebSocket(`ws://${location.host}/socket`);
  let over = false;
  socket.onmessage = (message: MessageEvent<string>) => {
    const said = JSON.parse(message.data) as Hello | Status | Records;
    if (said.type === "hello") {
      listener.hello(said);
      socket.send(JSON.stringify({ want: listener.wanted() }));
    } else if (said.type === "status") listener.status(said);
    else if (said.from > listener.wanted()) socket.send(JSON.stringify({ want: listener.wanted() }));
    else listener.records(said.from, said.records);
  };
  socket.onclose = () => {
    if (over) return;
    over = true;
    listener.lost();
    setTimeout(() => connect(listener), AGAIN_MS);
  };
}
