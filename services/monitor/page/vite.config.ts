import { defineConfig } from "vite";

// The page is served by the monitor itself: relative addresses, no source maps, one script and one style sheet.
export default defineConfig({
  base: "./",
  esbuild: { jsx: "automatic", jsxImportSource: "preact" },
  build: { target: "es2020", modulePreload: false, assetsInlineLimit: 0, chunkSizeWarningLimit: 200 },
});
