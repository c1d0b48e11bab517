import "@xyflow/react/dist/base.css";
import "./style.css";
import { createRoot } from "react-dom/client";
import { Page } from "./Page";
import { session } from "./session";

session.start();
createRoot(document.getElementById("page")!).render(<Page />);
