"""What cameras look at: star catalogue, Earth, Sun and Moon, attitudes, scenes, picture files."""
