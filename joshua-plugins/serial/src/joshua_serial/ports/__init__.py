"""What the commands around serial ports share: which ports there are, who holds them, what answers there."""
