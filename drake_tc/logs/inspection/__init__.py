"""What a log of unknown make holds, and a rig file to start from: `drake-tc inspect`."""
