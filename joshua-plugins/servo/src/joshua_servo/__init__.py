"""What drivers of servo buses share; a driver adds its protocol and its registers."""
