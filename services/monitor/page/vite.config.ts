import { defineConfig, type Plugin } from "vite";

/// The style sheet stands in the page itself: the first paint waits for one request and no script.
const inline_style: Plugin = {
  name: "inline-style",
  apply: "build",
  enforce: "post",
  generateBundle(_, bundle) {
    const page = bundle["index.html"];
    if (page?.type !== "asset") return;
    page.source = String(page.source).replace(/<link rel="stylesheet"[^>]*href="\.\/([^"]+)"[^>]*>/g, (_tag, name: string) => {
      const style = bundle[name];
      if (style?.type !== "asset") throw new Error(`index.html names ${name}, which was not built`);
      delete bundle[name];
      return `<style>${String(style.source)}</style>`;
    });
  },
};

// The page is served by the monitor itself: relative addresses, no source maps, one script.
export default defineConfig({
  base: "./",
  plugins: [inline_style],
  esbuild: { jsx: "automatic", jsxImportSource: "preact" },
  build: { target: "es2020", modulePreload: false, assetsInlineLimit: 0, chunkSizeWarningLimit: 200 },
});
