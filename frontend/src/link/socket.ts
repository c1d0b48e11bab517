/** The socket over which records come; it asks anew where it was when it was lost. */

import { parsed, recordsIn } from "../core/reading";
import type { Rec } from "../core/records";

export interface Hello {
  readonly type: "hello";
  readonly format: string;
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

export interface Listener {
  /** The number of the first record that is wanted. */
  wanted(): number;
  hello(said: Hello): void;
  status(said: Status): void;
  records(from: number, records: readonly Rec[]): void;
  lost(): void;
  /** Something came that cannot be read. */
  wrong(why: string): void;
}

const AGAIN_MS = 1500;

export function connect(listener: Listener): void {
  const socket = new WebSocket(`ws://${location.host}/socket`);
  let over = false;
  const want = () => socket.send(JSON.stringify({ want: listener.wanted() }));
  const take = (data: string) => {
    if (data.startsWith('{"type":"records"')) {
      const { from, records } = recordsIn(data);
      if (from > listener.wanted()) want();
      else listener.records(from, records);
      return;
    }
    const said = parsed(data) as Hello | Status;
    if (said.type === "status") return listener.status(said);
    listener.hello(said);
    want();
  };
  socket.onmessage = ({ data }: MessageEvent<string>) => {
    try {
      take(data);
    } catch (error) {
      listener.wrong(String(error));
    }
  };
  socket.onclose = () => {
    if (over) return;
    over = true;
    listener.lost();
    setTimeout(() => connect(listener), AGAIN_MS);
  };
}
