"""What the report draws: the residual over signals, over time and over frequency, as SVG."""
