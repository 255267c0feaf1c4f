"""How reports and pictures look; knows no command."""
