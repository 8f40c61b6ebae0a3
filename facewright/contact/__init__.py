"""Contact between the moving pieces of a head, solved per head after transfer."""



