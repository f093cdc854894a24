"""What a network sees: raw channels, a level frame, a filter with its state and innovations."""
