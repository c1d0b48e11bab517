import react from "@vitejs/plugin-react";
import { defineConfig } from "vite";

// Relative addresses, nothing inlined: the page is served under any port, with a policy that forbids inline scripts.
export default defineConfig({
  base: "./",
  plugins: [react()],
  build: {
    outDir: "../dsc/viewer/static",
    emptyOutDir: true,
    target: "es2023",
    cssTarget: ["chrome123", "firefox120", "safari17.5"], // which know light-dark(): drawings are saved in light colours
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    license: { fileName: "licenses.md" },
    rollupOptions: {
      output: {
        entryFileNames: "assets/[name].js",
        chunkFileNames: "assets/[name].js",
        assetFileNames: "assets/[name][extname]",
      },
    },
  },
  test: { include: ["test/**/*.test.ts"] },
} as Parameters<typeof defineConfig>[0]);
