"""Block graphs of Drake diagrams: read once, laid out by stage, written as SVG, DOT, Mermaid or JSON."""
