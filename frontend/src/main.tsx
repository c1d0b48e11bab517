import "@xyflow/react/dist/base.css";
import "./style.css";
import { createRoot } from "react-dom/client";
import { Boundary } from "./Boundary";
import { Page } from "./Page";
import { session } from "./session";

history.replaceState(null, "", location.pathname + location.hash); // the key has done its work: neither history nor bookmarks need it
session.start();
createRoot(document.getElementById("page")!).render(<Boundary about={null}><Page /></Boundary>);
