/** The panes, and the time line under all of them. */

import { useEffect, useState } from "react";
import { Components } from "./panes/Components";
import { Chart } from "./panes/Chart";
import { Graph } from "./panes/Graph";
import { Controls } from "./panes/Controls";
import { Header, Notice } from "./panes/Header";
import { Knowledge } from "./panes/Knowledge";
import { PlanPane } from "./panes/PlanPane";
import { Timeline } from "./panes/Timeline";
import { Why } from "./panes/Why";
import { World } from "./panes/World";
import { useKeys } from "./keys";
import { useControl, useKind, useSelection } from "./session";
import { Turn } from "./turn";

const TABS = ["Why", "Knowledge", "Components", "Control"] as const;

export function Page() {
  const selection = useSelection();
  const control = useControl();
  const [tab, setTab] = useState<(typeof TABS)[number]>("Why");
  useKeys();
  useEffect(() => {
    if (selection) setTab(selection.kind === "thing" ? "Knowledge" : "Why");
  }, [selection]);
  const kind = useKind();
  useEffect(() => {
    if (kind === "store") setTab("Knowledge");
  }, [kind]);
  const tabs = TABS.filter((name) => (name === "Control" ? control : name !== "Components" || kind !== "store"));
  return (
    <div className={`page ${kind}`}>
      <div className="top">
        <Header />
        <Notice />
      </div>
      {kind === "run" && <Turn><World /></Turn>}
      {kind === "run" && <Turn><PlanPane /></Turn>}
      <Turn>{kind === "store" ? <Graph /> : <Chart />}</Turn>
      <section className="pane side" aria-label={tab}>
        <div className="tabs" role="tablist" aria-label="Side">
          {tabs.map((name) => (
            <button key={name} role="tab" aria-selected={tab === name} onClick={() => setTab(name)}>
              {name}
            </button>
          ))}
        </div>
        <Turn>
          {tab === "Why" && <Why />}
          {tab === "Knowledge" && <Knowledge />}
          {tab === "Components" && <Components />}
        </Turn>
        {tab === "Control" && <Turn><Controls /></Turn>}
      </section>
      <Timeline />
    </div>
  );
}
