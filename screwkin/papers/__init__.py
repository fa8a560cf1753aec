"""What the two papers print, measured again: tables, figures and the page that compares."""
